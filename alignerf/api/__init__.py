"""For Python and notebooks: `import alignerf; alignerf.diagnose(...)`."""
