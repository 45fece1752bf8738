"""What all tests need."""

import signal

# A shell ignores Ctrl-C in what it runs in the background, and so would every program that the tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)
