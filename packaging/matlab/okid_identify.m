% SPDX-License-Identifier: MIT
% RESULT = okid_identify (INPUTS, OUTPUTS, FS, OPTIONS)
%
% Identify a record: INPUTS (samples x inputs, may be empty), OUTPUTS (samples x outputs), FS in Hz. OPTIONS: a struct with the
% long options of `okid identify`, - written _ (method, p, rows, order, refine, ...), and inputs and outputs, the
% names of the channels ({"force [N]"}). NaN = missing. RESULT is okid.result/1 as a struct. For MATLAB and GNU Octave.
function result = okid_identify (inputs, outputs, fs, options)
  if (nargin < 4)
    options = struct ();
  end
  options.fs = fs;
  if (~ isfield (options, 'inputs'))
    options.inputs = arrayfun (@(k) sprintf ('u%d', k), 1:size (inputs, 2), 'UniformOutput', false);
  end
  if (~ isfield (options, 'outputs'))
    options.outputs = arrayfun (@(k) sprintf ('y%d', k), 1:size (outputs, 2), 'UniformOutput', false);
  end
  result = jsondecode (okid_identify_mex (jsonencode (options), double (inputs), double (outputs)));
end
