"""The HTTP face: REST, the live feed, the page."""
