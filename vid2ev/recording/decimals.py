"""Whole numbers as decimals, without a digit lost on the way."""


def decimal(number: int, digits: int) -> str:
    """A number of units as one of 10**digits of them: -1500 with 3 digits is -1.500."""
    whole, rest = divmod(abs(number), 10**digits)
    return f"{'-' if number < 0 else ''}{whole}.{rest:0{digits}d}"
