"""Human motion for the legs to get used to: readers, retargeting to waist and arms, a generator, and clips on disk."""
