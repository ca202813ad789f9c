"""`wrcd install` and `wrcd uninstall`: units, network files, sysctl, manual pages, completion."""
