"""From reference points to a calibration: fitting, quality, load and save."""
