"""What the sensors bring beside the track: offsets, noise, joints, absurd values."""
