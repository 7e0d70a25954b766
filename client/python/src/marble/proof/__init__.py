"""Proofs that `marble solve --proof` has written: `python3 -m marble.proof.check_proof PROBLEM PROOF` checks one."""
