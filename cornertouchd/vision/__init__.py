"""One camera, pure: where the strip is, how bright it is, where its shadows are."""
