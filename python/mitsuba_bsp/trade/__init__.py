"""The command `trade`: what speed costs in accuracy and accuracy in speed, measured on purpose."""
