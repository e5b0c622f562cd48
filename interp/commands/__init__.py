"""The commands of interp: `vid2ev` finds them through their entry points."""
