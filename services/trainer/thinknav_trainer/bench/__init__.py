"""How fast ThinkNav is, as figures that a command prints: ours beside a peer's, measured in the same run."""
