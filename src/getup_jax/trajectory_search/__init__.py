"""Ways up from the floor that are found by sampling, before any learning.

Where a reference motion breaks physics, a policy that starts along it starts from states that
nothing leads out of. Sampling-based contact-rich motion control (Liu et al. 2010) turns the motion
into states that the character has really been in: many copies of it try short random changes of
the motion's servo targets, those that follow the curves best go on, and so forth to the end.
"""
