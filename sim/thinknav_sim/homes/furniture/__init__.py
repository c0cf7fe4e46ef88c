"""Pieces of furniture, one family a file.

Every builder takes a random generator and the home's style, and returns a mesh in the piece's own frame: metres, back
at z = 0, front towards +z, x = 0 in the middle, standing on y = 0. A builder knows nothing of rooms or placement.
"""
