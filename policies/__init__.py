"""From Command and State to Target: how that is computed, learnt and judged."""
