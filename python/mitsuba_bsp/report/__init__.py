"""One page about any set of results folders: what was measured, where, and how it looks."""
