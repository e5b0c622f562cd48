"""Events as the arrays that networks take."""
