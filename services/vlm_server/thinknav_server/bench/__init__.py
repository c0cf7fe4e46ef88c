"""How fast the service is on this machine, beside LitServe and beside its own model, and how it bears overload."""
