"""The benchmark that others can join: tasks with fixed budgets, baselines, submissions and their verification."""
