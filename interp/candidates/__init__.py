"""Pictures of an instant in closed form, from key frames and events."""
