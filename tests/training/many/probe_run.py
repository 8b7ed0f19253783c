"""`getup-train` with a probe in the place of the task: a process of a run that starts in a moment.

python probe_run.py CONFIG [key=value ...] [options of getup-train]
"""

from __future__ import annotations

import functools
import sys

from getup_jax.cli.main import train_main


def probe_job(config, log):
    from getup_jax.rl.learner import make_learner
    from getup_jax.training.loop import Job
    from probes import Probe, make_world

    learner = make_learner(Probe(), config.network, config.ppo, config.train.total_steps)
    world = make_world(3, by_sign=1.0, by_action=1.0, action_by_sign=0.5, shows_step=1.0)
    return Job(learner=learner, world=world, prior=None)


def main() -> int:
    from getup_jax.training import run

    run.run = functools.partial(run.run, build=probe_job)
    return train_main()


if __name__ == "__main__":
    sys.exit(main())
