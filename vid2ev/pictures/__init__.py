"""How events and light look: colours, their codes, and films that a browser plays."""
