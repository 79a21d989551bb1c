"""Controllers as the tests have them: they read a program by their own rules and say where the tool is sent.

They share no code with the crates. `arm.py` has the arms and their kinematics, `language.py` what the languages have in
common (expressions, variables, control flow), and each language is one file.
"""
