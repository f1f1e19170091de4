"""Reports of benchmarks, batches and videos as HTML, SVG and Markdown."""
