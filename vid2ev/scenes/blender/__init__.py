"""Scenes rendered by Blender's Cycles, in a process of its own: the optional high end beside the embedded renderer."""
