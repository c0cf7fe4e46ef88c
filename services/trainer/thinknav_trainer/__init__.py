"""The trainer of ThinkNav: policy, learner, the think action, the client of planners, evaluation, the command."""

import os

# Before torch loads OpenMP: threads that wait sleep instead of spinning. On a quiet machine spinning is a quarter
# faster; beside one other busy process it is several times slower (docs/log.md).
os.environ.setdefault("GOMP_SPINCOUNT", "0")
