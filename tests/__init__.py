"""The tests, by the packages that they test; a package by this name elsewhere must not hide this one."""
