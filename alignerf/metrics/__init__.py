"""Image metrics (PSNR, SSIM, LPIPS) and the networks behind them, without PyTorch."""
