"""What decides a recording, and what its cameras see of the source, instant by instant."""
