"""How the embedded networks are made: frames of homes, what is said about them, and the training on both."""
