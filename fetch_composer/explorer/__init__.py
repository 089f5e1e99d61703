"""What explore.py drives: rollouts of a policy, and files that show what happened.

Needs the optional extra `explore`, and is imported by nothing else in the package.
"""
