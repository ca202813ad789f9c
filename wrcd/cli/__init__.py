"""The commands of wrcd, a record each: arguments, examples, and what runs. Imports nothing slow."""
