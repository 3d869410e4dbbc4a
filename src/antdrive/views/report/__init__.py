"""Reports about many runs, as a web page or as text for a pull request."""
