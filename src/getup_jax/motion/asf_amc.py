"""Placeholder"""
def read_amc(path): raise NotImplementedError
