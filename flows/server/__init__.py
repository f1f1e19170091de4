"""The local Prefect server: its start, its liveness, and the requests that flows and commands send to it."""
