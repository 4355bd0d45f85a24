"""steplink's service: acceleration from a wearable in, live step counts out."""
