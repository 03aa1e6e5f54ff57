"""One image's pixels made those of another: of a straightened lens, or fewer."""
