"""Films and stills of a run, drawn from its log: `video` is the way in, the rest is how a picture is made."""
