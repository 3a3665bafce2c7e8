"""All coherent states that an order allows (its dual), as a space made of cubes."""
