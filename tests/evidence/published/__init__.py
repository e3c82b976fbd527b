"""What others have published, or recorded, of linkages with several drives or freedoms; their numbers and how to read
them.
"""
