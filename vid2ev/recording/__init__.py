"""What is kept of a conversion: the preview, the manifest, and the folder that holds them or nothing."""
