"""The least of what joints do, proven, and the motion that attains it."""
