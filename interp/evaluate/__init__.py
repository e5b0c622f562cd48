"""How good methods are: the field's protocol, and what it leaves out."""
