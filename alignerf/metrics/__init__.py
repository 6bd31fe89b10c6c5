"""Image metrics: PSNR, SSIM and LPIPS."""
