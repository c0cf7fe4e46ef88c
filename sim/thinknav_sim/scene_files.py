"""What the files of scenes are called. Knows nothing of what is in them."""

# Those that an import leaves or reads, HM3D's double ending before the one in it.
SCENE_ENDINGS = (".npz", ".basis.glb", ".glb", ".obj", ".ply")
# What Habitat's datasets name besides.
_OTHER_ENDINGS = (".scene_instance.json",)


def scene_name_of(file_name: str) -> str:
    """A scene's name, by that of its file: "TEEsavR23oF.basis.glb" is "TEEsavR23oF", and "flat.2" is itself."""
    for ending in (*SCENE_ENDINGS, *_OTHER_ENDINGS):
        if file_name.lower().endswith(ending):
            return file_name[: -len(ending)]
    return file_name
