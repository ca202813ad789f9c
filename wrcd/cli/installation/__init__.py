"""What `wrcd install` and `wrcd uninstall` lay out, plan, change and ask of a computer."""
