"""How the weights of steplink's own counter are learnt: material, clips, network, fit, cross-validation, model card."""
