"""The motion of people: fitted per shot, aligned into one world, refined."""
