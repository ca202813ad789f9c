"""Many runs: jobs, what works on them, what they came to."""
