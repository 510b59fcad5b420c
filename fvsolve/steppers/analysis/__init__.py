"""What a Butcher array says of its method: order, stability, Pade. Knows exact numbers; knows no time loop."""
