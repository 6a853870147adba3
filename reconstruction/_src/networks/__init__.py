"""Networks that grow over points: the self-reconstruction map and the growing grid."""
