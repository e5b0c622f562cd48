"""A recording made: the whole path from a video to its folder, in one go or shared out among workers."""
