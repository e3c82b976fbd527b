"""The engines: multibody engines that see only the mechanism, never an analytic result."""
