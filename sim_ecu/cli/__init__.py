"""The commands of sim-ecu, a record each: arguments, examples, and what runs. Imports nothing slow."""
