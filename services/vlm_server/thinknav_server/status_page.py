"""The page at `/` for people: who plans, how busy it is, how long things take, and what it said last.

One HTML file without scripts, that loads itself again every few seconds.
"""

import base64
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import simplejpeg

from thinknav_proto import Frame, PlannerInfo
from thinknav_server.images import decode_frame
from thinknav_server.recent import Recent, Seen

SHARES = (0.5, 0.9, 0.99)

_STYLE = """
:root { color-scheme: light dark; --line: #8884; --bar: #4a7dbd; --bad: #c0392b; --good: #2e8b57 }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.4rem; margin-bottom: 0 } h2 { font-size: 1.05rem; margin: 2rem 0 .5rem }
.state { font-weight: 600; color: var(--bad) } .state.ready { color: var(--good) }
table { border-collapse: collapse } td, th { padding: .15rem 1.2rem .15rem 0; text-align: left; vertical-align: top }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums } tr + tr td { border-top: 1px solid var(--line) }
.bar { background: var(--bar); height: .8rem; min-width: 2px } .bars td:last-child { width: 24rem }
.frames { display: grid; grid-template-columns: repeat(auto-fill, minmax(13rem, 1fr)); gap: 1rem }
figure { margin: 0 } img { width: 100%; display: block; border-radius: 4px }
figcaption b { display: block } figcaption span, .quiet { opacity: .65; font-size: .85rem }
"""


@dataclass(frozen=True)
class Status:
    """What the page tells of a service at one moment."""

    info: PlannerInfo
    ready: bool
    waiting: int
    in_flight: int
    cached: int
    restarts: int
    queue_size: int


def render_status(status: Status, recent: Recent) -> str:
    """The whole page."""
    state = '<span class="state ready">ready</span>' if status.ready else '<span class="state">not ready</span>'
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="5">
<meta name="viewport" content="width=device-width"><title>ThinkNav planning service</title>
<style>{_STYLE}</style></head><body>
<h1>ThinkNav planning service: {state}</h1>
<p class="quiet">{escape(status.info.identity)}; as of {time.strftime("%Y-%m-%d %H:%M:%S")}, loads again every 5 s</p>
<h2>Planner</h2>{_facts(status)}
<h2>Latencies of the last {len(recent.answers)} answers</h2>{_latencies(recent.quantiles(SHARES))}
<h2>Batches</h2>{_batches(recent.batches)}
<h2>Last frames</h2>{_frames(recent)}
</body></html>
"""


def _facts(status: Status) -> str:
    info = status.info
    rows = {
        "planner": info.identity,
        "prompt": info.prompt_hash,
        "embeddings": info.embedding_space,
        "waiting": f"{status.waiting} of {status.queue_size}",
        "in flight": str(status.in_flight),
        "answers remembered": str(status.cached),
        "started again": f"{status.restarts} times",
    }
    return _table([f"<td>{escape(name)}</td><td>{escape(value)}</td>" for name, value in rows.items()])


def _latencies(quantiles: Mapping[str, Sequence[float]]) -> str:
    if not quantiles:
        return '<p class="quiet">Nobody has asked yet.</p>'
    head = "<th>milliseconds</th>" + "".join(f'<th class="n">{share:.0%}</th>' for share in SHARES)
    rows = [
        f"<td>{escape(stage)}</td>" + "".join(f'<td class="n">{value:.1f}</td>' for value in values)
        for stage, values in quantiles.items()
    ]
    return _table([head, *rows])


def _batches(batches: Counter[int]) -> str:
    if not batches:
        return '<p class="quiet">None yet.</p>'
    most = max(batches.values())
    rows = [
        f'<td class="n">{size}</td><td class="n">{count}</td>'
        f'<td><div class="bar" style="width:{100 * count / most:.1f}%"></div></td>'
        for size, count in sorted(batches.items())
    ]
    return _table(['<th class="n">requests</th><th class="n">batches</th><th></th>', *rows], "bars")


def _frames(recent: Recent) -> str:
    if not recent.keeps_frames:
        return (
            '<p class="quiet">Not kept; <code>--show-frames</code> shows the last dozen to whoever opens this page.</p>'
        )
    if not recent.frames:
        return '<p class="quiet">None yet.</p>'
    return f'<div class="frames">{"".join(_figure(seen) for seen in reversed(recent.frames))}</div>'


def _figure(seen: Seen) -> str:
    when = time.strftime("%H:%M:%S", time.localtime(seen.at))
    try:
        picture = f'<img alt="frame" src="{_data_uri(seen.frame)}">'
    except ValueError:  # a side longer than JPEG knows
        picture = '<p class="quiet">Too long to be shown.</p>'
    return (
        f"<figure>{picture}<figcaption><b>{escape(seen.subgoal)}</b>"
        f"<span>{escape(seen.goal)}, {escape(seen.client)}, {when}</span></figcaption></figure>"
    )


def _data_uri(frame: Frame) -> str:
    encoding, data = frame.encoding, frame.data
    if encoding == "raw":
        encoding, data = "jpeg", simplejpeg.encode_jpeg(decode_frame(frame), quality=85)
    return f"data:image/{encoding};base64,{base64.b64encode(data).decode()}"


def _table(rows: Sequence[str], kind: str = "") -> str:
    return f'<table class="{kind}">' + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>"
