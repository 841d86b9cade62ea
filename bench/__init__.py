"""The whole program measured from outside: it is started, driven, watched and timed. `policies.bench` judges policies alone."""
