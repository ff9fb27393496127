"""Runs policies exported by gdg-tui, with numpy alone.

    gdg-tui export-policy run.safetensors --plans

writes `exports/run.policy.safetensors`, and

    import gdg_tui

    policy = gdg_tui.load_policy("exports/run.policy.safetensors")
    action = policy(state, goal)        # of the actor alone
    walk = policy.walk(goal)            # with plans: through bridge points, as in the program
    action = walk.step(state)           # once for each step of the environment

All of it computes in double precision; the program does in single precision.
"""

from ._file import PolicyError
from ._plans import Walk
from ._policy import Policy, load_policy

__all__ = ["Policy", "PolicyError", "Walk", "load_policy"]
