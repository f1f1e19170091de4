"""The paper's networks behind the alignment: ms-HMR (3.3.2), trajectory predictor and trajectory refiner (3.4)."""
