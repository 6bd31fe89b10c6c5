// What `alignerf.kernels.build` compiles, and JAX calls by these names.
#include "adam.h"
#include "histograms.h"
#include "lookup.h"

namespace ffi = xla::ffi;
using Array = ffi::Buffer<ffi::F32>;
using Counts = ffi::Span<const int32_t>;

XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_lookup, lookup::Forward,
                              ffi::Ffi::Bind()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Attr<Counts>("resolutions")
                                  .Attr<Counts>("entries"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_lookup_gradient, lookup::Backward,
                              ffi::Ffi::Bind()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Attr<Counts>("resolutions")
                                  .Attr<Counts>("entries"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_resample, histograms::Resample,
                              ffi::Ffi::Bind()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Attr<float>("dilation")
                                  .Attr<bool>("jittered"));
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_interlevel, histograms::Interlevel,
                              ffi::Ffi::Bind()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>());
XLA_FFI_DEFINE_HANDLER_SYMBOL(alignerf_adam, adam::Update,
                              ffi::Ffi::Bind()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Arg<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Ret<Array>()
                                  .Attr<float>("beta_1")
                                  .Attr<float>("beta_2")
                                  .Attr<float>("rest_1")
                                  .Attr<float>("rest_2")
                                  .Attr<float>("eps"));
