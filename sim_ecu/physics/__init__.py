"""Contact, wheelset, track and sensors. Imports nothing of wrcd: it is the other half of the experiment."""
