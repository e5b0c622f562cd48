"""Where it goes: event files, the preview, the manifest, and the folder that holds them or nothing."""
