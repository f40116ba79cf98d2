"""Services on several hosts: the site's file, its checks, what each host needs, and the certificates."""
