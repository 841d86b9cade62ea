"""Episodes on disk: one MCAP file a session that survives a crash."""
