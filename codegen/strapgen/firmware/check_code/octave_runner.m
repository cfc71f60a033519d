% Calls a user's function in MATLAB, in a process of Octave that may crash.
% Run as: octave-cli octave_runner.m FOLDER CALLS, with a plan of the call in JSON in the folder.
1;
function put(file, text)
    out = fopen(file, 'w');
    fputs(out, text);
    fclose(out);
end
function numbers = doubles(file, shape)
    in = fopen(file, 'r');
    numbers = fread(in, shape, 'double=>double');
    fclose(in);
end
function array = arranged(numbers, shape)
    if numel(shape) == 2
        array = reshape(numbers, shape(2), shape(1));
    else
        array = numbers(:);
    end
end
function shape = shape_of(array)
    shape = size(array);
end
function run(folder, calls)
    plan = jsondecode(fileread(fullfile(folder, 'plan')), 'makeValidName', false);
    addpath(plan.folder);
    kind = 'double';
    if strcmp(plan.type, 'float')
        kind = 'single';
    end
    identity = cast(doubles(fullfile(folder, 'identity'), Inf), kind);
    rows = doubles(fullfile(folder, 'input'), [Inf]);
    rows = reshape(rows, [], calls);
    count = numel(plan.parameters);
    outputs = zeros(numel(identity), calls);
    state = identity;
    for k = 1:calls
        row = rows(:, k);
        if row(1)
            clear(plan.function);
            state = identity;
            if ~isempty(plan.init)
                feval(plan.init);
            end
        end
        known = plan.constants;
        known.dt = row(2);
        known.dt_ms = 1e3 * row(2);
        known.dt_us = 1e6 * row(2);
        known.step = row(3);
        known.zeros = zeros(9, 1);
        place = 4;
        for n = 1:numel(plan.fed)
            size = plan.fed{n}{2};
            known.(plan.fed{n}{1}) = row(place:place + size - 1);
            place = place + size;
        end
        place = 1;
        for n = 1:numel(plan.results)
            size = plan.results{n}{2};
            if ~isempty(plan.results{n}{3})
                known.(plan.results{n}{3}) = state(place:place + size - 1);
            end
            place = place + size;
        end
        given = cell(1, count);
        for n = 1:count
            name = plan.parameters{n}{1};
            shape = plan.parameters{n}{2};
            given{n} = known.(name);
            element = plan.parameters{n}{3};
            if element >= 0
                given{n} = cast(given{n}(element + 1), kind);
            elseif numel(shape) > 0
                given{n} = cast(arranged(known.(name)(1:prod(shape)), shape), kind);
            end
            if numel(shape) == 2 && strcmp(name, 'state')
                given{n} = given{n}.';
            end
        end
        returned = {};
        try
            [returned{1:numel(plan.results)}] = feval(plan.function, given{:});
        catch caught
            text = regexprep(caught.message, '\s+', ' ');
            if strncmp(text, 'parse error', 11)
                put(fullfile(folder, 'refused'), [plan.module ' cannot be read: ' text]);
            elseif ~isempty(strfind(text, 'called with too many inputs'))
                put(fullfile(folder, 'refused'), [plan.function ' does not take these --arguments: ' text]);
            else
                put(fullfile(folder, 'stopped'), ['it raises an error: ' text]);
            end
            return;
        end
        state = [];
        for n = 1:numel(plan.results)
            part = returned{n};
            size = plan.results{n}{2};
            if ~isnumeric(part) || numel(part) ~= size
                put(fullfile(folder, 'refused'), sprintf('%s gives an array of the shape [%s]; %d numbers are needed', ...
                    plan.function, num2str(shape_of(part)), size));
                return;
            end
            if size == 9 && shape_of(part)(1) == 3
                part = part.';
            end
            state = [state; cast(part(:), kind)];
        end
        outputs(:, k) = double(state);
    end
    out = fopen(fullfile(folder, 'output'), 'w');
    fwrite(out, outputs, 'double');
    fclose(out);
    put(fullfile(folder, 'flags'), '0');
end
words = argv();
run(words{end - 1}, str2double(words{end}));
