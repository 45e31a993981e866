"""A hand's motion on another skeleton: how its bones are found, how they turn, and how touches are kept.

It needs numpy alone, as it runs inside animation programs too.
"""
